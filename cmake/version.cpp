#include "warp/Export.h"

extern "C" WARP_API const char *warp_version() { return WARP_VERSION; }
