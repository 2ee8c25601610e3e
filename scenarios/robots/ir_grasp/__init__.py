"""A soft hand corrects its grasp by infrared reflexes, closes, pulls and shakes. [Luberto] sec. V."""
