"""The pools of operators that suit a kernel: search, synthesis, and the front of the best ones."""
