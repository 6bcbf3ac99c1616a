# make build   .venv with the package in it, and build/bin/warp-opt
# make package .venv with the package in it
# make demo    particles, an ocean, a cloth and a trajectory optimised, a rollout differentiated,
#              a mesh, grains, rocks: pictures and tables in build/demo (docs/gallery.md)
# make test    every test; ends with 'N passed, N failed, N skipped'
# make report scenes with a reference, swept and timed: pages in build/report
# make docs    refresh the generated references under docs/, build the site in build/site
# make bench   benchmarks/spine.py, startup.py, shapes.py, random_programs.py, gpu.py, autodiff.py,
#              pool.py, libraries.py, optimised build (build/release)
# make demo WHEEL=dist/NAME.whl  the same with an installed wheel, without a build
# make wheel   an optimised wheel in dist/, of 25 MB at most, for glibc 2.28 and later
# make wheels PYTHONS="python3.10 python3.12"  and one for each of these interpreters
# make shim    a wheel in dist/ that stands for `warp-lang`, for clients that require it
# make tools   a wheel in dist/ with `warp-opt`
# make runtime  a wheel in dist/ for C++ programs: libwarp_runtime.so, which has no compiler
# make vdb     a wheel in dist/ with the component for files of OpenVDB, and the libraries it needs
# make check-wheel  installs each in an empty environment and runs programs from there
# Everything that is missing (packages, .venv, build) is set up first.

SHELL := /bin/bash
PYTHON := .venv/bin/python

.PHONY: environment build package demo report test release bench docs site wheel wheels shim tools runtime vdb check-wheel device-bundle format clean

export WHEEL

environment:
	@scripts/setup.sh environment

build:
	@scripts/setup.sh

# Without the pass tool and the tests.
package:
	@scripts/setup.sh package

demo: package
	@$(PYTHON) examples/particles.py --cloud 4096 $(DEMO_ARGS)
	@$(PYTHON) examples/ocean.py
	@$(PYTHON) examples/cloth.py
	@$(PYTHON) examples/trajectory.py
	@$(PYTHON) examples/spring_rollout.py
	@$(PYTHON) examples/mesh_collision.py
	@$(PYTHON) examples/grains.py --grains 20000 --steps 60
	@$(PYTHON) examples/rocks.py
	@$(PYTHON) examples/several_devices.py

report: package
	@$(PYTHON) -m warp.report --quick $(REPORT_ARGS)

test: build
	@$(PYTHON) scripts/run_tests.py $(TEST_ARGS)

docs: build
	@scripts/make_docs.sh
	@$(MAKE) --no-print-directory site

site:
	@PYTHONPATH=build/python $(PYTHON) -m sphinx -q -W --keep-going -b html docs build/site
	@echo "build/site/index.html"

release: environment
	@cmake --preset release -DPython_EXECUTABLE=$(CURDIR)/$(PYTHON) >/dev/null
	@ninja -C build/release --quiet

bench: release
	@PYTHONPATH=build/release/python $(PYTHON) benchmarks/spine.py $(BENCH_ARGS)
	@PYTHONPATH=build/release/python $(PYTHON) benchmarks/startup.py
	@PYTHONPATH=build/release/python $(PYTHON) benchmarks/shapes.py
	-@PYTHONPATH=build/release/python $(PYTHON) benchmarks/random_programs.py
	@PYTHONPATH=build/release/python $(PYTHON) benchmarks/gpu.py
	@PYTHONPATH=build/release/python $(PYTHON) benchmarks/autodiff.py
	@PYTHONPATH=build/release/python $(PYTHON) benchmarks/pool.py
	@PYTHONPATH=build/release/python $(PYTHON) benchmarks/libraries.py

# In the folder of the optimised build, whose objects it takes.
wheel: release
	@$(PYTHON) -m pip wheel -q --no-deps --no-build-isolation -C build-dir=build/release -w dist .
	@$(PYTHON) scripts/finish_wheel.py $$(ls -t dist/*-linux_x86_64.whl | head -1) --pythons $(PYTHONS)
	@! find dist -name '*.whl' -size +25000000c -printf '%f has %s bytes, more than 25,000,000\n' | grep .

wheels: wheel

shim: environment
	@$(PYTHON) scripts/make_shim.py

tools: release
	@ninja -C build/release --quiet warp-opt
	@$(PYTHON) scripts/make_tools.py

runtime: release
	@ninja -C build/release --quiet warp_runtime
	@$(PYTHON) scripts/make_runtime.py

vdb: release
	@$(PYTHON) scripts/make_vdb.py

check-wheel: wheel
	@$(PYTHON) scripts/check_wheel.py dist/warp_mlir-*-manylinux*.whl --pythons $(PYTHONS) $(CHECK_ARGS)

device-bundle: release
	@scripts/make_device_bundle.sh build/release

format:
	@git ls-files '*.cpp' '*.h' | xargs -r clang-format-22 -i
	@$(PYTHON) -m ruff format python test examples benchmarks scripts

clean:
	rm -rf build .venv dist
