"""Functions of the package `planfly`; each is loaded at its first use, and returns read-only data."""
