#!/bin/sh
# Runs the commands that README.md shows (indented lines that begin with "alabaster"), as they stand, on a copy of demo/.
#   readme.sh SOURCE_FOLDER PROGRAM
set -eu
source=$1 program=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/bin" "$work/demo"
ln -s "$program" "$work/bin/alabaster"
cp "$source"/demo/*.json "$work/demo"
sed -n 's/^    \(alabaster .*\)/\1/p' "$source/README.md" >"$work/commands"
[ "$(wc -l <"$work/commands")" -ge 5 ] || { echo "README.md shows fewer than five commands"; exit 1; }
cd "$work"
PATH=$work/bin:$PATH
while read -r command; do
    echo "\$ $command"
    $command </dev/null
done <commands
[ -s demo/report/index.html ] || { echo "no demo/report/index.html"; exit 1; }
