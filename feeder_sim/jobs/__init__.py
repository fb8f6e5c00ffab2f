"""Much work in many processes: seeds of scenarios as tasks, executors that run them, a journal of what is done."""
