// Lets two baked solids approach each other, and prints when the verdict turns.    approach A.etree B.etree
//
// A stays; B comes along the x axis in 100 poses, from well apart until the centers of the root ellipsoids meet.
// One context serves all queries, as it would in the loop of a simulator.
#include <prolate/collide.hpp>

#include <cstdio>
#include <memory>

namespace {

constexpr int kSteps = 100;

const char* word(prolate::Verdict verdict) {
    const char* const words[] = {"separated", "overlapping", "undecided"};
    return words[static_cast<int>(verdict)];
}

} // namespace

int main(int argc, char** argv) {
    if (argc != 3) return std::fputs("usage: approach A.etree B.etree\n", stderr), 2;
    const auto a = prolate::load(argv[1]), b = prolate::load(argv[2]);
    for (const auto* tree : {&a, &b})
        if (!*tree) return std::fprintf(stderr, "approach: %s\n", tree->error().what), 1;

    // Along x, an ellipsoid reaches |transpose(L) x| = l11 to either side of its center, so the roots lie side by side
    // when their centers are the sum apart. Twice that sets the path's length: models of any size and place will do.
    const prolate::Ellipsoid root_a = a->view().ellipsoid(0), root_b = b->view().ellipsoid(0);
    const float start = 2 * (root_a.l11 + root_b.l11);

    const auto context = std::make_unique<prolate::QueryContext>();
    prolate::Pose pose; // of B; the rotation stays the identity
    prolate::Verdict before = prolate::Verdict::undecided;
    unsigned long long pair_tests = 0, most = 0, separated = 0;
    for (int step = 0; step < kSteps; ++step) {
        const float apart = start * static_cast<float>(kSteps - 1 - step) / (kSteps - 1);
        pose.translation = {root_a.center.x - root_b.center.x + apart, root_a.center.y - root_b.center.y,
                            root_a.center.z - root_b.center.z};
        const auto result = prolate::collide(a->view(), {}, b->view(), pose, *context);
        const unsigned long long tests = result.stats.pair_tests;
        if (step == 0 || result.verdict != before)
            std::printf("pose %3d of %d, centers %8.4f apart: %-11s (%llu pair tests)\n", step + 1, kSteps,
                        static_cast<double>(apart), word(result.verdict), tests);
        before = result.verdict;
        pair_tests += tests;
        most = tests > most ? tests : most;
        separated += result.verdict == prolate::Verdict::separated ? 1 : 0;
    }
    std::printf("%d poses: %llu separated, %llu not; %llu pair tests in all, at most %llu in one query\n", kSteps,
                separated, kSteps - separated, pair_tests, most);
    return 0;
}
