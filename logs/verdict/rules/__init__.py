"""The rules of the verdict, one file each, and the list of them."""
