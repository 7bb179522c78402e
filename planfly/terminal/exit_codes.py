"""What an exit code means."""

EXIT_CODES = """\
exit codes: 0 flyable
            1 internal or system error
            2 incorrect usage or invalid input, nothing written
            3 finished with a reported loss (a damaged log), or undecided
            4 not flyable, or no feasible plan
            130 and 143 ended by SIGINT (Ctrl-C) and SIGTERM, within a second"""

FLYABLE, FAULT, BAD_INPUT, LOSS, NOT_FLYABLE = 0, 1, 2, 3, 4
# By Ctrl-C, as a shell counts what a signal ended: 128 and the signal's number.
INTERRUPTED = 130
