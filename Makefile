# `make run` opens the viewer, `make test` checks everything; both set up what they need, in this folder alone.

SHELL := /bin/sh
.SHELLFLAGS := -eu -c
.DEFAULT_GOAL := run

VENV := .venv
PYTHON := $(VENV)/bin/python
FILE ?= assets/sample
FRAMES ?= 24
OUT := out

# Debian's names of what a window needs, and of what the tests need besides.
WINDOW_PACKAGES := libgl1 libegl1 libgl1-mesa-dri libglx-mesa0 libx11-6 libxext6 libxrandr2 libxinerama1 libxcursor1 libxi6 libxrender1 libxkbcommon0
TEST_PACKAGES := xvfb xdotool

# What the shipped weights are made from: folders of light fields to train on and to hold out, and photographs (docs/training.md).
DATA ?= ../shared/data
TEXTURES ?= textures
WEIGHTS ?= $(OUT)/weights
# Captures as a Lytro Illum's own software stores them are three of twenty; they count three times, as do the three with large
# disparities. Two mosaics of an F01, decoded here, count twice.
F01 = $(WEIGHTS)/f01/IMG_1.lfp $(WEIGHTS)/f01/IMG_2.lfp
ILLUM = $(foreach name,IMG_0288 bikes_4 bikes_11,$(DATA)/train/$(name))
LARGE = $(foreach name,hci_antinous hci_bicycle hci_pens,$(DATA)/train/$(name))
ALL = $(DATA)/train $(ILLUM) $(ILLUM) $(LARGE) $(LARGE) $(F01) $(F01)
# In the second part of the training half of what is drawn comes from the three of the Illum, a seventh from the F01.
CAPTURES = $(DATA)/train $(foreach n,1 2 3 4 5 6 7 8,$(ILLUM)) $(LARGE) $(foreach n,1 2 3 4,$(F01)) $(DATA)/train/Bikes $(DATA)/train/Bikes
# What the channels of full are looked at on.
NARROWING = $(ILLUM) $(LARGE) $(foreach name,Bikes meadow toys bins drainpipe Begonia koala,$(DATA)/train/$(name))
TRAIN = $(PYTHON) -m app train --val $(DATA)/val --generated 300 --textures $(TEXTURES) --balance 0.75
FIRST = $(WEIGHTS)/first

.PHONY: run test weights lint clean window-packages test-packages

run: $(VENV)/ready window-packages
	@if [ -n "$${DISPLAY:-}$${WAYLAND_DISPLAY:-}" ] || [ "$$(uname -s)" = Darwin ]; then \
		exec $(PYTHON) -m app view "$(FILE)"; \
	fi; \
	echo "There is no display here, so the same is done off screen: $(OUT)/viewer.png and $(OUT)/sweep.mp4."; \
	mkdir -p $(OUT); \
	$(PYTHON) -m app view "$(FILE)" --screenshot $(OUT)/viewer.png; \
	$(PYTHON) -m app sweep "$(FILE)" --path circle --frames $(FRAMES) --out $(OUT)/sweep.mp4; \
	echo "Written: $(OUT)/viewer.png and $(OUT)/sweep.mp4."

test: $(VENV)/ready-for-tests window-packages test-packages
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy
	$(PYTHON) -m pytest -n 2 --dist loadgroup -m "not alone"
	$(PYTHON) -m pytest -m alone

# The small pair first, since it teaches the paper's pair: about 3, 3 and 1 hours on two cores. Each goes on where it was stopped.
weights: $(VENV)/ready $(WEIGHTS)/f01/ready
	mkdir -p $(FIRST)
	$(TRAIN) --data $(ALL) --generated-share 0.4 --model realtime --out $(FIRST)/realtime.safetensors --patch 128 --batch 8 --lr 1e-3 --steps 30000 --decay 0.75 --average 0.998 --matching 200 --tones 0.6
	$(TRAIN) --data $(CAPTURES) --generated-share 0.2 --model realtime --init $(FIRST)/realtime.safetensors --out $(WEIGHTS)/realtime.safetensors --patch 240 --batch 3 --group 1 --lr 8e-4 --steps 6600 --decay 0.85 --average 0.999 --matching 0 --tones 0.3
	$(TRAIN) --data $(ALL) --generated-share 0.4 --model full --out $(FIRST)/full.safetensors --teacher $(WEIGHTS)/realtime.safetensors --tones 0.5 --patch 100 --batch 4 --lr 1e-3 --steps 37000 --decay 0.7 --average 0.998 --matching 0
	$(PYTHON) -m lfcore.training.narrowing $(FIRST)/full.safetensors $(WEIGHTS)/full.safetensors --data $(NARROWING)
	$(TRAIN) --data $(ALL) --generated-share 0.4 --model single --out $(WEIGHTS)/single.safetensors --patch 100 --batch 4 --lr 1e-3 --steps 24000 --decay 0.5 --average 0.998

$(WEIGHTS)/f01/ready: $(VENV)/ready
	mkdir -p $(@D)
	$(PYTHON) -m tests.measure_decoding $(@D) --raw $(DATA)/raw_f01/IMG_1.jpg $(DATA)/raw_f01/IMG_2.jpg
	touch $@

lint: $(VENV)/ready-for-tests
	$(VENV)/bin/ruff check .
	$(VENV)/bin/mypy

clean:
	rm -rf $(VENV) $(OUT) build *.egg-info

# The program is installed in place, in the versions of constraints.txt; touched last, so that a broken set-up is done again.
SOURCES_OF_SETUP := pyproject.toml constraints.txt $(wildcard lfcore/kernels/*.[ch] app/painting/*.[ch])

$(VENV)/ready: $(SOURCES_OF_SETUP)
	@$(call install,.)
	@touch $@

# With what tests need, in one go, for each installation compiles the kernels.
$(VENV)/ready-for-tests: $(SOURCES_OF_SETUP)
	@$(call install,.[test])
	@touch $(VENV)/ready $@

# $(call install,WHAT): into the environment, which is made where there is none.
define install
$(find_python); \
$(make_venv); \
echo "Setting up in $(VENV) (the first time about 1.3 GB, most of it torch) ..."; \
$(PYTHON) -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '$(1)'
endef

define find_python
python=; \
for name in $${PYTHON3:-} python3 python3.13 python3.12 python3.11; do \
	if command -v $$name >/dev/null 2>&1 && $$name -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; then \
		python=$$name; break; \
	fi; \
done; \
if [ -z "$$python" ]; then \
	echo "Python 3.11, 3.12 or 3.13 was not found; install one of them, or name it: make run PYTHON3=/path/to/python3" >&2; exit 2; \
fi
endef

define make_venv
if ! $$python -m venv $(VENV) >/dev/null 2>&1; then \
	$(call apt_install,python3-venv); \
	$$python -m venv $(VENV); \
fi
endef

# $(call apt_install,PACKAGES): install them, or say in one sentence what is missing. Never asks for a password.
define apt_install
echo "Installing $(1) ..."; \
if command -v apt-get >/dev/null 2>&1 && [ "$$(id -u)" = 0 ]; then \
	apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $(1) >/dev/null; \
elif command -v apt-get >/dev/null 2>&1 && sudo -n true 2>/dev/null; then \
	sudo apt-get update -qq && sudo DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $(1) >/dev/null; \
else \
	echo "These are needed and could not be installed from here: $(1) (Debian's names); install them and run this again." >&2; exit 2; \
fi
endef

# The libraries are looked for by name, for on a desktop another package or vendor may have brought them.
window-packages:
	@if [ "$$(uname -s)" = Linux ]; then \
		found=$$( (ldconfig -p || /sbin/ldconfig -p) 2>/dev/null ); \
		for library in libGL.so.1 libEGL.so.1 libX11.so.6 libXext.so.6 libXrandr.so.2 libXinerama.so.1 libXcursor.so.1 libXi.so.6 libxkbcommon.so.0; do \
			case "$$found" in *$$library*) ;; *) $(call apt_install,$(WINDOW_PACKAGES)); break ;; esac; \
		done; \
	fi

test-packages:
	@if [ "$$(uname -s)" = Linux ]; then \
		for program in Xvfb xdotool; do \
			command -v $$program >/dev/null 2>&1 || { $(call apt_install,$(TEST_PACKAGES)); break; }; \
		done; \
	fi
