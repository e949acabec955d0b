.PHONY: run test clean

run:
	scripts/setup
	.venv/bin/mfopt run examples/rice-quick.toml --resume

test:
	scripts/setup dev,cluster,cad
	scripts/check

clean:
	rm -rf .venv runs
