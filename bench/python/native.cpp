// The time of collide_poses() without Python:    native A.etree B.etree POSES SECONDS
//
// POSES is a file of float32 poses, x y z qx qy qz qw, of B; A stands at the identity. Prints two times, nanoseconds:
// the least time of a pose, of all of them in one call; and the median over the poses of the least time of a call of
// collide(), eight of them in a row.
#include <prolate/collide.hpp>
#include <prolate/poses.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <vector>

namespace {

template <class Work> double least_time(double seconds, const Work& work) {
    using Clock = std::chrono::steady_clock;
    double best = 1e30;
    for (const auto end = Clock::now() + std::chrono::duration<double>(seconds); Clock::now() < end;) {
        const auto start = Clock::now();
        work();
        best = std::min(best, std::chrono::duration<double, std::nano>(Clock::now() - start).count());
    }
    return best;
}

} // namespace

int main(int argc, char** argv) {
    if (argc != 5) return std::fputs("usage: native A.etree B.etree POSES SECONDS\n", stderr), 2;
    const auto a = prolate::load(argv[1]), b = prolate::load(argv[2]);
    std::ifstream file(argv[3], std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    if (!a || !b || bytes.size() < sizeof(prolate::Pose))
        return std::fputs("native: cannot read its files\n", stderr), 1;
    std::vector<prolate::Pose> poses(bytes.size() / sizeof(prolate::Pose));
    std::copy_n(bytes.begin(), poses.size() * sizeof(prolate::Pose), reinterpret_cast<char*>(poses.data()));
    const std::vector<prolate::Pose> here(1);
    std::vector<prolate::CollideResult> out(poses.size());
    const auto context = std::make_unique<prolate::QueryContext>();
    const double seconds = std::atof(argv[4]);
    const double batch = least_time(seconds, [&] {
        if (!prolate::collide_poses(a->view(), here, b->view(), poses, out, {context.get(), 1})) std::abort();
    });
    std::vector<double> single;
    for (const prolate::Pose& pose : poses)
        single.push_back(least_time(seconds / static_cast<double>(poses.size()), [&] {
            for (int i = 0; i < 8; ++i) out[0] = collide(a->view(), here[0], b->view(), pose, *context);
        }));
    std::nth_element(single.begin(), single.begin() + single.size() / 2, single.end());
    std::printf("%.1f %.1f\n", batch / static_cast<double>(poses.size()), single[single.size() / 2] / 8);
    return 0;
}
