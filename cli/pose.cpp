#include "cli/pose.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

namespace prolate::cli {

Outcome<Pose> parse_pose(std::string_view text) {
    const Failure refused{kUsage, "--pose", "not three or seven finite numbers, the quaternion not zero",
                          "write tx,ty,tz or tx,ty,tz,qx,qy,qz,qw"};
    float numbers[7] = {0, 0, 0, 0, 0, 0, 1};
    size_t count = 0;
    for (bool more = true; more;) {
        if (count == std::size(numbers)) return refused;
        const size_t comma = text.find(',');
        more = comma != text.npos;
        std::string_view word = text.substr(0, comma);
        if (more) text.remove_prefix(comma + 1);
        while (word.starts_with(' ')) word.remove_prefix(1);
        while (word.ends_with(' ')) word.remove_suffix(1);
        if (word.starts_with('+')) word.remove_prefix(1);
        float& number = numbers[count++];
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
        if (error != std::errc() || end != word.data() + word.size() || !std::isfinite(number)) return refused;
    }
    if (count != 3 && count != 7) return refused;
    if (std::all_of(numbers + 3, numbers + 7, [](float q) { return q == 0; })) return refused;
    return Pose{{numbers[0], numbers[1], numbers[2]}, {numbers[3], numbers[4], numbers[5], numbers[6]}};
}

} // namespace prolate::cli
