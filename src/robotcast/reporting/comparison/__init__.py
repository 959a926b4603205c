"""The page that lays a model's predictions beside the measured casts, and its blocks.

Every block is made from the dict of `comparison.json` alone, so another page can show it too.
"""
