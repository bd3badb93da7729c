"""What several providers need beside the contracts: frames seen, clouds, an arm's chain and hand, outside packages."""
