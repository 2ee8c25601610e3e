"""The grasp scene: a soft hand with infrared sensors and an object on a table."""
