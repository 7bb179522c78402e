"""Settings that hold for all tests."""

from hypothesis import settings

# The first example of a test may compile kernels, or share its core with another test: neither is the kernel's fault.
settings.register_profile("planfly", deadline=None)
settings.load_profile("planfly")
