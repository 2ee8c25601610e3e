"""A hand offers a ball; the Helix finds it with two cameras and takes it. [Vervloet2025] sec. 3.5.1."""
