"""Study of what the layers of paper 3's network keep of the classes, with its denoising network and without."""
