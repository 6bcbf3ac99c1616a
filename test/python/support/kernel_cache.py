"""The files in the folder of a kernel cache."""


def codes(folder):
    """Pieces of machine code in a cache."""
    return len(list(folder.glob("*.code")))
