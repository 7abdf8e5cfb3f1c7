"""Study of shallow domain adaptation (CORAL, subspace alignment, LinOT, JDOT) beside the methods of paper 3."""
