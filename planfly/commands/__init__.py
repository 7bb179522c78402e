"""One module a command, each with a function of its own name; `registry` finds it."""
