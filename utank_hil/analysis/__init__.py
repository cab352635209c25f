"""Analysis: margins, frequency responses, figures of a run."""
