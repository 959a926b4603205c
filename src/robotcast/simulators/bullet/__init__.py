"""The cable as capsules on a plane in PyBullet."""
