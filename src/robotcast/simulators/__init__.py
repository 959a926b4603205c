"""Simulators of a cast, which all answer the same simulate call (`simulator`).

`chain` holds those that MuJoCo steps, `bullet` PyBullet's, `batch` what runs many casts at once.
"""
