"""An arm of variable-stiffness links follows paths without seeing its tip. [Gandarias2020] sec. V."""
