"""A simulator of casts and a measurement set as diagnosis sees them."""
