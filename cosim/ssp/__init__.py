"""Systems as other tools exchange them: System Structure and Parameterization (SSP) 1.0 and 2.0."""
