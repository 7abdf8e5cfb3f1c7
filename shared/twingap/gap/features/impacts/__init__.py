"""Features of the impacts of a defect."""
