"""How a study is carried out: what a participant goes through, the page, the hand's devices, a run for each round."""
