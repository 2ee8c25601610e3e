"""Robots that hand objects over, as Functional Mock-up Units, and the master that co-simulates them.

`handover.cosim` is the engine; `handover.plants` and `handover.controllers` have the robots' models and controllers;
`handover.fmus` makes units of them; `handover.scenarios` has the experiments and the command line.
"""
