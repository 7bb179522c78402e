"""Terminal interface: parser, progress, results, exit codes."""
