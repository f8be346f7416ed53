"""A second formulation: rigid bodies with Cartesian poses, joints as constraints between them, springs, drives and
gaps as energies of relative poses. It reads the description's dataclasses; nothing of the core, and nothing of
`tests.oracle.energy` but the record of the loads, is used."""
