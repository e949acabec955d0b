"""PyBullet, rigid bodies in a process of its own."""
