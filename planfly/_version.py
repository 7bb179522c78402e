"""Define the version of planfly, which every module can read."""

__version__ = "0.2.0"
