"""What a person at a terminal meets: the parser, progress, results, exit codes."""
