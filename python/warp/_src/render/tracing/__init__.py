"""A path tracer in kernels: geometry, scattering, sky, film and noise removal."""
