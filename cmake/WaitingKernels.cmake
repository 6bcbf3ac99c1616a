# cmake -DIN=kernels.ptx -DOUT=waiting.ptx -P WaitingKernels.cmake: the kernels
# of a file for sm_90, as lib/Runtime/cuda/LibraryKernels.cpp has them for the
# driver.
file(READ "${IN}" text)
string(REGEX REPLACE "\\.target sm_[0-9]+" ".target sm_90" text "${text}")
string(REPLACE "\n{\n" "\n{\n\tgriddepcontrol.wait;\n" text "${text}")
file(WRITE "${OUT}" "${text}")
