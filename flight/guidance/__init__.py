"""Where to fly and with which commands: the fly-by path, lateral and vertical laws, inner loops and gains."""
