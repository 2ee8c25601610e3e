"""A free-flying robot in microgravity yields to pushes, gives objects to people and takes them. [Fernandes2020]."""
