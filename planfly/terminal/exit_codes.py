"""What an exit code means."""

EXIT_CODES = """\
exit codes: 0 flyable; 1 our fault or the machine's; 2 bad usage or bad input (nothing was written);
3 done with a stated loss (an unfinished or damaged log, a probability left undecided); 4 not flyable, or no
feasible plan"""

FLYABLE, FAULT, BAD_INPUT, LOSS, NOT_FLYABLE, INTERRUPTED = 0, 1, 2, 3, 4, 130
