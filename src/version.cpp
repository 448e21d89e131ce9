#include <prolate/version.hpp>

namespace prolate {

uint32_t library_version() noexcept {
    return kHeaderVersion;
}

} // namespace prolate
