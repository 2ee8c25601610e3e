"""Physics and sensors: what happens in the world."""
