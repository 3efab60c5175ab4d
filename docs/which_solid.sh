#!/bin/sh
# Measures the errors of the formulations in docs/guide/which_solid.md: runs the verification cases of its table with each
# formulation, keeps the results in docs/which_solid.json, and renews the figures of the page. Takes minutes after the build.
#
# PERIMELT names a program to use instead of building one.
set -eu
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
perimelt=${PERIMELT:-$target/release/perimelt}
[ -n "${PERIMELT:-}" ] || cargo build --release
cases=$target/which_solid
rm -rf "$cases"
mkdir -p "$cases"

# copied NAME FORMULATION ...: NAME with each formulation, as NAME-FORMULATION
copied() {
  name=$1
  shift
  for formulation in "$@"; do
    # the springs of a staggered solid are not those of the others
    keep=p
    [ "$formulation" = staggered ] || keep='/^stabilisation/!p'
    sed -n -e "s/^formulation = .*/formulation = \"$formulation\"/" -e "$keep" \
      "cases/verification/$name.toml" >"$cases/$name-$formulation.toml"
  done
}
copied welded-sheet staggered correspondence ordinary
copied confined-hot-spot staggered correspondence ordinary
copied confined-hot-spot-fine staggered correspondence ordinary
copied confined-hot-layers staggered correspondence
copied confined-strip staggered correspondence
copied confined-columns staggered correspondence
for name in hill-cylinder-staggered hill-cylinder hill-cylinder-ordinary cook-membrane cook-membrane-correspondence; do
  cp "cases/verification/$name.toml" "$cases"
done
# limits are those of the staggered solid: others fail them
"$perimelt" verify --full --cases "$cases" --output docs/which_solid.json || true
"$perimelt" verify --report docs/which_solid.json --into docs/guide/which_solid.md
