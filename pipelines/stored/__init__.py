"""What is done with the results of commands once they are there, without computing anything again."""
