"""The first start after an install: what compiles is said, shared between processes, and counted."""
