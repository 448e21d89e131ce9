// Reading and atomic writing of whole files (POSIX).
#include <prolate/tree.hpp>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace prolate {
namespace {

Error io(const char* what) {
    return {ErrorCode::io, what, static_cast<uint64_t>(errno)};
}

class Descriptor {
public:
    explicit Descriptor(int fd) : fd_(fd) {}
    ~Descriptor() {
        if (fd_ >= 0) ::close(fd_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    explicit operator bool() const { return fd_ >= 0; }
    int get() const { return fd_; }
    // Delayed write errors may surface only here.
    bool close() { return ::close(std::exchange(fd_, -1)) == 0; }

private:
    int fd_;
};

bool write_all(int fd, std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
        const ssize_t n = ::write(fd, bytes.data(), bytes.size());
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return false;
        bytes = bytes.subspan(static_cast<size_t>(n));
    }
    return true;
}

} // namespace

Result<Tree> Tree::open(std::vector<std::byte> bytes, const OpenOptions& options) {
    auto view = TreeView::open(bytes, options);
    if (!view) return view.error();
    return Tree(std::move(bytes), *view);
}

Result<Tree> load(const char* path) {
    const Descriptor file(::open(path, O_RDONLY | O_CLOEXEC));
    if (!file) return io("cannot open the file");
    struct stat status {};
    if (::fstat(file.get(), &status) != 0) return io("cannot read the file");
    if (S_ISDIR(status.st_mode)) {
        errno = EISDIR;
        return io("cannot read the file");
    }
    std::vector<std::byte> bytes;
    if (status.st_size > 0) bytes.reserve(static_cast<size_t>(status.st_size));
    std::byte buffer[1 << 16];
    for (;;) {
        const ssize_t n = ::read(file.get(), buffer, sizeof buffer);
        if (n < 0 && errno == EINTR) continue;
        if (n < 0) return io("cannot read the file");
        if (n == 0) break;
        bytes.insert(bytes.end(), buffer, buffer + n);
    }
    return Tree::open(std::move(bytes));
}

Result<void> save(const char* given_path, std::span<const std::byte> bytes) {
    // Behind a symbolic link, its target is replaced and the link kept.
    const std::unique_ptr<char, decltype(&std::free)> real(::realpath(given_path, nullptr), &std::free);
    const char* const path = real ? real.get() : given_path;
    struct stat status {};
    if (::stat(path, &status) == 0 && !S_ISREG(status.st_mode)) { // a pipe or device: nothing to replace
        Descriptor device(::open(path, O_WRONLY | O_CLOEXEC));
        if (!device) return io("cannot open the output");
        if (!write_all(device.get(), bytes) || !device.close()) return io("cannot write the output");
        return {};
    }
    std::string temporary = std::string(path) + ".tmp-XXXXXX";
    Descriptor file(::mkostemp(temporary.data(), O_CLOEXEC));
    if (!file) return io("cannot create a file there");
    const auto give_up = [&](const char* what) {
        const Error error = io(what);
        ::unlink(temporary.c_str());
        return error;
    };
    // mkostemp creates with mode 0600; a new file gets what the umask leaves of 0666, a replaced one keeps its mode.
    mode_t mode = status.st_mode & 07777;
    if (mode == 0) {
        const mode_t mask = ::umask(0);
        ::umask(mask);
        mode = 0666 & ~mask;
    }
    if (::fchmod(file.get(), mode) != 0) return give_up("cannot set the file's mode");
    if (!write_all(file.get(), bytes) || ::fsync(file.get()) != 0 || !file.close())
        return give_up("cannot write the file");
    if (::rename(temporary.c_str(), path) != 0) return give_up("cannot move the file to its name");
    // Make the new name durable; a file system that cannot is no reason to fail.
    const std::string name(path);
    const size_t slash = name.rfind('/');
    const std::string folder = slash == std::string::npos ? "." : name.substr(0, slash + 1);
    if (const Descriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)); directory)
        ::fsync(directory.get());
    return {};
}

} // namespace prolate
