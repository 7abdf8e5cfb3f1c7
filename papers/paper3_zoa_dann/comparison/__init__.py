"""The paper's comparison: nine methods and the analyst's rule, seven tasks, three states of the target data, noise."""
