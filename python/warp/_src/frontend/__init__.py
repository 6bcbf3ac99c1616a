"""The front end: Python functions become modules of the warp dialect.

How a kernel goes through it:

    source      text and syntax tree of the function, without `inspect`
    control     break, continue and return become flags; which names are live where
    translator  the context of a function, and a part for each topic that holds it
    names       what a free name refers to
    functions   parameters and overloads of `@wp.func`

The parts, each with the methods of its topic: statements, branches, loops; targets (assignment),
slots (places), slices; expressions, access (attributes, subscripts), spreads (`*`), indexed,
local_arrays; calls, constructors, output, user_calls, references, custom_derivatives,
derivative_calls; tiles, loaded when needed. A part reaches another one through the context:
`self.context.slots.write(...)`.

The translator calls the native builder, which has all type rules. Translation is deterministic: the
text of the module keys the kernel cache.
"""
