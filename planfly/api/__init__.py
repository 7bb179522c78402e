"""Functions of `import planfly`, each of which is loaded with its first use and returns frozen data."""
