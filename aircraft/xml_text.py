"""Write elements of JSBSim's XML functions: numbers, products and sums."""


def number(value: float) -> str:
    """Return a number with all significant digits.

    >>> number(0.1), number(2.0), number(-1 / 3)
    ('0.1', '2', '-0.333333333333')
    """
    return f"{value + 0.0:.12g}"


def multiply(*parts: str) -> str:
    """Return an element for the product of elements.

    >>> multiply("<p> a </p>", "<v> 2 </v>")
    '<product> <p> a </p> <v> 2 </v> </product>'
    """
    return f"<product> {' '.join(parts)} </product>"


def scale(value: float, *properties: str) -> str:
    """Return an element for the product of a number and properties.

    >>> scale(2.0, "x", "y")
    '<product> <v> 2 </v> <p> x </p> <p> y </p> </product>'
    """
    return multiply(f"<v> {number(value)} </v>", *(f"<p> {name} </p>" for name in properties))


def add(*parts: str) -> str:
    """Return an element for the sum of elements.

    >>> add("<v> 1 </v>", "<p> a </p>")
    '<sum> <v> 1 </v> <p> a </p> </sum>'
    """
    return f"<sum> {' '.join(parts)} </sum>"
