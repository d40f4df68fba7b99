"""What an assistant asks over the Model Context Protocol: the answers of the commands, read-only and small."""
