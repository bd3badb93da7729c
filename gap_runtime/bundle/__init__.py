"""GraphBundle: the one unit after generation, and the digest that says what it holds and was checked against."""
