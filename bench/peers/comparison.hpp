// Compares libraries on pairs of meshes: the same poses, answers checked, all timed in turns.
#pragma once

#include "bench/peers/library.hpp"
#include "bench/peers/sweep.hpp"

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace prolate::bench::peers {

struct ComparisonOptions {
    size_t poses = 500;
    uint64_t seed = 1;
    double seconds = 0.5; ///< see SweepOptions
    std::string data;     ///< folder of meshes
};

enum class Query : uint8_t { collide, distance };

/// What is timed together: all libraries at one kind of poses of one pair of meshes.
struct Subject {
    Query query;
    std::string a, b;         ///< names of models, or paths
    std::string kind;         ///< far, near, touching; near-aligned, ...
    std::string name() const; ///< collide/horse-bunny/near
};

/// What came out for one library.
struct Outcome {
    std::string library;
    Timing timing;
    std::optional<double> volume_tests, triangle_tests; ///< a query, on average
    size_t wrong = 0;                                   ///< answers that are not those of the reference
};

class Comparison {
public:
    Comparison(ComparisonOptions options, Libraries libraries);

    const Libraries& libraries() const { return libraries_; }
    /// False if one of the meshes cannot be had; the reason is printed once.
    bool available(const Subject& subject);
    /// Runs the libraries called `names` (those that answer the query). Prints whose answers are wrong.
    std::vector<Outcome> run(const Subject& subject, const std::vector<std::string>& names);
    /// Bytes that a model takes in a library; 0 if it was not built or does not tell.
    size_t bytes(const std::string& library, const std::string& model) const;

private:
    struct Entry {
        std::optional<Model> model;
        std::unique_ptr<Reference> reference;
        std::map<std::string, std::unique_ptr<Shape>> shapes; // by library
    };
    Entry& entry(const std::string& name);
    const std::vector<Placement>& poses(const Subject& subject);
    std::vector<double> expected_distances(const Subject& subject, std::span<const std::unique_ptr<Scene>> scenes);

    ComparisonOptions options_;
    Libraries libraries_;
    std::map<std::string, Entry> models_;
    std::map<std::string, PoseSets> poses_; // by pair, and whether aligned
};

/// Names of the meshes that a model's name may stand for, and of `cad`.
std::string model_name(const std::string& path_or_name);

} // namespace prolate::bench::peers
