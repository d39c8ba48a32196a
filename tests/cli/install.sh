#!/bin/sh
# Installs the build and uses what was installed as a stranger's project does: by pkg-config and by find_package.
#   install.sh BUILD_FOLDER
set -eu
build=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/prefix" >"$work/log"
cat >"$work/main.c" <<'C'
#include "fit/material.h"
#include <stdio.h>

int main(void)
{
    const alb_profile profile = {ALB_FORM_EXPONENTIAL, {2, 2}};
    printf("%.6f\n", alb_profile_total(&profile)); // 2 pi a / b^2
    return 0;
}
C
cat >"$work/CMakeLists.txt" <<'C'
cmake_minimum_required(VERSION 3.25)
project(stranger C CXX)
find_package(alabaster REQUIRED)
add_executable(stranger main.c)
target_link_libraries(stranger PRIVATE alabaster::alabaster)
C
PKG_CONFIG_PATH=$(dirname "$(find "$work/prefix" -name alabaster.pc)")
export PKG_CONFIG_PATH
cc "$work/main.c" $(pkg-config --cflags --libs alabaster) -o "$work/by_pkg_config"
cmake -S "$work" -B "$work/build" -DCMAKE_PREFIX_PATH="$work/prefix" >>"$work/log"
cmake --build "$work/build" >>"$work/log"
for program in "$work/by_pkg_config" "$work/build/stranger"; do
    [ "$("$program")" = 3.141593 ] || { echo "$program: wrong answer"; exit 1; }
done
"$work/prefix/bin/alabaster" --version
