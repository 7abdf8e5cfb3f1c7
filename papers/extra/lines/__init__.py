"""Study of recordings that show the line of their own fault, compared with recordings without the fault."""
