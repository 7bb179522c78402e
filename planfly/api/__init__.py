"""The verbs of `import planfly`: each loads with its first use, and gives frozen data."""
