"""Ten goals a robot in emulated worlds, with the real navigation packages; `make test-navigation` runs them."""
