"""Published experiments of the arm with links of variable stiffness: [Gandarias2020] sec. V."""
