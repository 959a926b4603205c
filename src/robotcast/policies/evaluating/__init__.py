"""How far chosen casts end from their targets, and what that error is made of."""
