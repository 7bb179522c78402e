"""Settings of all tests."""

from hypothesis import settings

# A test's first call may compile a kernel, which takes longer than any deadline that is of use.
settings.register_profile("planfly", deadline=None)
settings.load_profile("planfly")
